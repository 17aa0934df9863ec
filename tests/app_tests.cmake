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
