tessera_test(check_surface_test FOLDER surface OPTIMISED LINK surface reference PRIVATE_LINK tessera_gmp)
tessera_test(extend_fields_test FOLDER surface LINK surface reference)
if(TESSERA_BUILD_IO)
  tessera_test(read_surface_test FOLDER mesh_files LINK reader)
endif()
if(TARGET tessera_tetrahedralize)
  # Tests of the program, from outside; docs/testing.md tells of the long runs.
  set(folder ${CMAKE_CURRENT_SOURCE_DIR}/tetrahedralize)
  foreach(suite Bad Options Good Fields Repair Points Sizes Resample)
    add_test(NAME tetrahedralize_test.${suite}
      COMMAND ${TESSERA_PYTHON} -B ${folder}/tetrahedralize_test.py --program $<TARGET_FILE:tessera_tetrahedralize>
              --tessera $<TARGET_FILE:tessera> ${suite})
  endforeach()
  add_test(NAME mesh_statistics_test COMMAND ${TESSERA_PYTHON} -B ${folder}/mesh_statistics_test.py)
  add_test(NAME mutated_surfaces
    COMMAND ${TESSERA_PYTHON} -B ${folder}/mutated_surfaces.py --program $<TARGET_FILE:tessera_tetrahedralize> --count 60 --seed 1 --jobs 2
            --keep ${PROJECT_BINARY_DIR}/mutated_surfaces)
  set_tests_properties(mutated_surfaces PROPERTIES PROCESSORS 2)
endif()
