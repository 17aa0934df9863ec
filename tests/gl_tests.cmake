tessera_test(gl_test LINK gl)
tessera_embed_glsl(gl_test glsl/layered.vert.glsl glsl/layered.frag.glsl glsl/shared_value.glsl)
tessera_test(gl_draw_test LINK gl)
set_tests_properties(gl_test gl_draw_test PROPERTIES TIMEOUT 300)
