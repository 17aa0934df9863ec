# One target a folder: tessera_layer(<name> [UNITY] SOURCES ... LINK <layers> PRIVATE_LINK <libraries> PUBLIC_LINK <libraries>).
# UNITY: its sources are compiled a few at a time, which pays where headers cost more than the sources.
# The LINK list of a layer is its row in docs/architecture.md; tests/layering_test.py compares the includes with it.

add_library(tessera_flags INTERFACE)
target_compile_options(tessera_flags INTERFACE
  -pthread -ffp-contract=off -Wall -Wextra -Wshadow -Wconversion
  # Signs are no part of GCC's -Wconversion for C++; & of comparisons is meant, where a branch would cost more.
  $<$<CXX_COMPILER_ID:Clang>:-Wno-sign-conversion;-Wno-bitwise-instead-of-logical>
  $<$<BOOL:${TESSERA_WERROR}>:-Werror>)
if(TESSERA_SANITIZE)
  target_compile_options(tessera_flags INTERFACE -fsanitize=${TESSERA_SANITIZE} -fno-omit-frame-pointer
    -fno-sanitize-recover=all)
  if(TESSERA_SANITIZE_LESS)
    target_compile_options(tessera_flags INTERFACE -fno-sanitize=${TESSERA_SANITIZE_LESS})
  endif()
  target_link_options(tessera_flags INTERFACE -fsanitize=${TESSERA_SANITIZE})
endif()

include(TesseraPrecompiled)
set_property(GLOBAL PROPERTY TESSERA_LAYERS "")

function(tessera_layer name)
  cmake_parse_arguments(ARG "UNITY" "" "SOURCES;LINK;PUBLIC_LINK;PRIVATE_LINK" ${ARGN})
  add_library(tessera_${name} STATIC ${ARG_SOURCES})
  add_library(Tessera::${name} ALIAS tessera_${name})
  set_target_properties(tessera_${name} PROPERTIES EXPORT_NAME ${name})
  target_compile_features(tessera_${name} PUBLIC cxx_std_20)
  target_include_directories(tessera_${name} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include> $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src>
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  foreach(layer IN LISTS ARG_LINK)
    target_link_libraries(tessera_${name} PUBLIC tessera_${layer})
  endforeach()
  target_link_libraries(tessera_${name} PUBLIC ${ARG_PUBLIC_LINK} PRIVATE ${ARG_PRIVATE_LINK}
    $<BUILD_INTERFACE:tessera_flags>)
  tessera_precompile(tessera_${name})
  if(ARG_UNITY OR TESSERA_UNITY)
    set_target_properties(tessera_${name} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 7)
    # It asks whether a type stands in the file compiled, which is never so here.
    target_compile_options(tessera_${name} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
  endif()
  set_property(GLOBAL APPEND PROPERTY TESSERA_LAYERS ${name})
endfunction()

function(tessera_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK;PRIVATE_LINK;PRECOMPILED" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_compile_features(${name} PRIVATE cxx_std_20)
  foreach(layer IN LISTS ARG_LINK)
    target_link_libraries(${name} PRIVATE tessera_${layer})
  endforeach()
  target_link_libraries(${name} PRIVATE ${ARG_PRIVATE_LINK} tessera_flags)
  # -fPIC like the layers, in place of -fPIE, so that one precompiled header serves both.
  set_target_properties(${name} PROPERTIES POSITION_INDEPENDENT_CODE OFF)
  target_compile_options(${name} PRIVATE -fPIC)
  tessera_precompile(${name} ${ARG_PRECOMPILED})
endfunction()
