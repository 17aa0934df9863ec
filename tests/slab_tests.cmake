tessera_test(slab_generator_test LINK reference registry)
set(slab_tests slab_generator_test)
set_tests_properties(${slab_tests} PROPERTIES TIMEOUT 300)
