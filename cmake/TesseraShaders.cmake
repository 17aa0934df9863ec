# tessera_embed_glsl(<layer or program> files...): puts GLSL files of the current folder into the target, which must link gl. Its
# sources include "<layer>/shaders.h" and find slab.vert.glsl as tessera::shaders::<layer>::kSlabVert, a ShaderText.
function(tessera_embed_glsl layer)
  set(target ${layer})
  if(TARGET tessera_${layer})
    set(target tessera_${layer})
  endif()
  set(folder ${CMAKE_CURRENT_BINARY_DIR}/shaders)
  set(files "")
  set(constants "")
  set(declarations "")
  foreach(file IN LISTS ARGN)
    get_filename_component(name ${file} NAME)
    string(REGEX REPLACE "\\.glsl$" "" words ${name})
    string(REGEX MATCHALL "[A-Za-z0-9]+" words ${words})
    set(constant k)
    foreach(word IN LISTS words)
      string(SUBSTRING ${word} 0 1 first)
      string(SUBSTRING ${word} 1 -1 rest)
      string(TOUPPER ${first} first)
      string(APPEND constant ${first}${rest})
    endforeach()
    list(APPEND files ${CMAKE_CURRENT_SOURCE_DIR}/${file})
    list(APPEND constants ${constant})
    string(APPEND declarations "extern const ShaderText ${constant};\n")
  endforeach()
  file(CONFIGURE OUTPUT ${folder}/${layer}/shaders.h @ONLY CONTENT
    "#pragma once\n\n#include \"gl/shader_text.h\"\n\nnamespace tessera::shaders::${layer} {\n\n${declarations}\n}\n")
  set(script ${PROJECT_SOURCE_DIR}/cmake/EmbedGlsl.cmake)
  add_custom_command(OUTPUT ${folder}/${layer}/shaders.cpp
    COMMAND ${CMAKE_COMMAND} "-DLAYER=${layer}" "-DFILES=${files}" "-DCONSTANTS=${constants}"
            "-DOUTPUT=${folder}/${layer}/shaders.cpp" -P ${script}
    DEPENDS ${files} ${script} ${folder}/${layer}/shaders.h
    COMMENT "Embedding the shaders of ${layer}" VERBATIM)
  target_sources(${target} PRIVATE ${folder}/${layer}/shaders.cpp)
  target_include_directories(${target} PRIVATE ${folder})
endfunction()
