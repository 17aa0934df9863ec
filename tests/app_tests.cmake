set(TESSERA_PYTHON /usr/bin/python3 CACHE FILEPATH "Python with Debian's modules (vtk, pyopenvdb, numpy)")
add_test(NAME layering_test COMMAND ${TESSERA_PYTHON} ${CMAKE_CURRENT_SOURCE_DIR}/layering_test.py)

if(TARGET tessera)
  foreach(suite BadInput FailingOutputs Interruption Reports Series Help)
    add_test(NAME app_test.${suite}
      COMMAND ${TESSERA_PYTHON} ${CMAKE_CURRENT_SOURCE_DIR}/app_test.py --tessera $<TARGET_FILE:tessera>
              --data ${PROJECT_SOURCE_DIR}/data ${suite})
  endforeach()
  if(NOT TESSERA_SANITIZE)
    add_test(NAME external_check_against_vtk
      COMMAND ${TESSERA_PYTHON} ${CMAKE_CURRENT_SOURCE_DIR}/external/check_against_vtk.py --tessera $<TARGET_FILE:tessera>
              ${PROJECT_SOURCE_DIR}/data ${PROJECT_SOURCE_DIR}/../shared/data)
    add_test(NAME install_test
      COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/install_test.sh ${PROJECT_BINARY_DIR} ${PROJECT_SOURCE_DIR})
  endif()
endif()

# What runs under the sanitizers in CI: every layer's own tests, and the contract's; not the long passes over real meshes.
set(sanitized base_test mesh_test split_test read_test software_test brick_tree_test brick_store_test refine_test seams_test
  measure_error_test oracle_test contract_test vdb_file_test image_test)
set(sanitized_here "")
foreach(test IN LISTS sanitized)
  if(TEST ${test})
    list(APPEND sanitized_here ${test})
    set_property(TEST ${test} APPEND PROPERTY LABELS sanitized)
  endif()
endforeach()
add_custom_target(sanitized_tests DEPENDS ${sanitized_here})
if(TARGET tessera)
  add_dependencies(sanitized_tests tessera)
  set_property(TEST app_test.BadInput APPEND PROPERTY LABELS sanitized)
endif()
