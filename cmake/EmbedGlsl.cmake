# Run as a script by tessera_embed_glsl(): writes OUTPUT, the C++ source with the text of FILES as the CONSTANTS of LAYER.
set(source "#include \"${LAYER}/shaders.h\"\n\nnamespace tessera::shaders::${LAYER} {\n")
foreach(file constant IN ZIP_LISTS FILES CONSTANTS)
  get_filename_component(name ${file} NAME)
  file(READ ${file} text)
  string(APPEND source "\nconstinit const ShaderText ${constant}{\"${name}\", R\"GLSL(${text})GLSL\"};\n")
endforeach()
string(APPEND source "\n}  // namespace tessera::shaders::${LAYER}\n")
file(WRITE ${OUTPUT} "${source}")
