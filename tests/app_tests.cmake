set(TESSERA_PYTHON /usr/bin/python3 CACHE FILEPATH "Python with Debian's modules (vtk, pyopenvdb, numpy)")
add_test(NAME layering_test COMMAND ${TESSERA_PYTHON} ${CMAKE_CURRENT_SOURCE_DIR}/layering_test.py)

if(TARGET tessera)
  foreach(suite BadInput Repair Outputs FailingOutputs Interruption Reports Programs Refinement Pictures Slices FocusTraces Series Compare Bench Reader Terminal Help Drivers)
    add_test(NAME app_test.${suite}
      COMMAND ${TESSERA_PYTHON} ${CMAKE_CURRENT_SOURCE_DIR}/app/app_test.py --tessera $<TARGET_FILE:tessera>
              --data ${PROJECT_SOURCE_DIR}/data --broken-drivers ${CMAKE_CURRENT_BINARY_DIR}/broken_driver ${suite})
  endforeach()
  if(TARGET tessera_view_program)
    add_test(NAME window_test COMMAND ${TESSERA_PYTHON} ${CMAKE_CURRENT_SOURCE_DIR}/view/window_test.py --tessera $<TARGET_FILE:tessera>
      --data ${PROJECT_SOURCE_DIR}/data --broken-drivers ${CMAKE_CURRENT_BINARY_DIR}/broken_driver)
  endif()
  # What the tests in Python run, beside tessera: it looks for the reading process where it is itself.
  tessera_program(forked_tessera PRECOMPILED tessera_app_precompiled SOURCES app/forked_tessera.cpp PRIVATE_LINK tessera_app)
  target_include_directories(forked_tessera PRIVATE ${PROJECT_SOURCE_DIR}/apps/tessera)
  set_target_properties(forked_tessera PROPERTIES RUNTIME_OUTPUT_DIRECTORY $<TARGET_FILE_DIR:tessera>)
  # An algorithm from outside src/: two files and one registration.
  tessera_program(tessera_with_oracle SOURCES ${PROJECT_SOURCE_DIR}/apps/tessera/main.cpp app/register_oracle.cpp contract/oracle_resampler.cpp
    LINK reference PRIVATE_LINK tessera_app)
  target_include_directories(tessera_with_oracle PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
  add_test(NAME own_algorithm_test
    COMMAND tessera_with_oracle compare ${PROJECT_SOURCE_DIR}/data/ccx-cavity/cavity.vtu --algorithms software,oracle --resolution 16)
  # Short runs; docs/testing.md tells of the long ones.
  add_test(NAME mutated_meshes
    COMMAND ${TESSERA_PYTHON} -B ${CMAKE_CURRENT_SOURCE_DIR}/fuzz/run_mutated.py --tessera $<TARGET_FILE:tessera>
            --writer $<TARGET_FILE:write_box_files> --count 12 --seed 1 --jobs 2 --keep ${PROJECT_BINARY_DIR}/mutants)
  add_test(NAME escape_test
    COMMAND ${TESSERA_PYTHON} -B ${CMAKE_CURRENT_SOURCE_DIR}/app/escape_test.py --tessera $<TARGET_FILE:tessera>
            --box-writer $<TARGET_FILE:write_box_files> --link-writer $<TARGET_FILE:write_linked_files> --jobs 2)
  add_test(NAME kill_test
    COMMAND ${TESSERA_PYTHON} ${CMAKE_CURRENT_SOURCE_DIR}/app/kill_test.py --tessera $<TARGET_FILE:tessera> --data ${PROJECT_SOURCE_DIR}/data
            --count 20 --seed 1)
  set_tests_properties(mutated_meshes escape_test kill_test PROPERTIES PROCESSORS 2)
  add_test(NAME random_plans
    COMMAND ${TESSERA_PYTHON} -B ${CMAKE_CURRENT_SOURCE_DIR}/random_plans.py --tessera $<TARGET_FILE:tessera> --seeds 1-25
            --keep ${PROJECT_BINARY_DIR}/plans)
  if(NOT TESSERA_SANITIZE)
    add_test(NAME external_check_against_vtk
      COMMAND ${TESSERA_PYTHON} ${CMAKE_CURRENT_SOURCE_DIR}/external/check_against_vtk.py --tessera $<TARGET_FILE:tessera>
              ${PROJECT_SOURCE_DIR}/data ${PROJECT_SOURCE_DIR}/../shared/data)
    add_test(NAME install_test
      COMMAND ${TESSERA_PYTHON} ${CMAKE_CURRENT_SOURCE_DIR}/app/install_test.py ${PROJECT_BINARY_DIR} ${PROJECT_SOURCE_DIR})
  endif()
endif()

# Tests of the program that makes tetrahedra, from outside; docs/testing.md tells of the long runs.
if(TARGET tessera_tetrahedralize)
  set(tetrahedralize ${CMAKE_CURRENT_SOURCE_DIR}/tetrahedralize)
  foreach(suite Bad Options Good Parts Fields Repair Points Sizes Resample)
    add_test(NAME tetrahedralize_test.${suite}
      COMMAND ${TESSERA_PYTHON} -B ${tetrahedralize}/tetrahedralize_test.py --program $<TARGET_FILE:tessera_tetrahedralize>
              --tessera $<TARGET_FILE:tessera> ${suite})
  endforeach()
  add_test(NAME mesh_statistics_test COMMAND ${TESSERA_PYTHON} -B ${tetrahedralize}/mesh_statistics_test.py)
  add_test(NAME mutated_surfaces
    COMMAND ${TESSERA_PYTHON} -B ${tetrahedralize}/mutated_surfaces.py --program $<TARGET_FILE:tessera_tetrahedralize> --count 60 --seed 1
            --jobs 2 --keep ${PROJECT_BINARY_DIR}/mutated_surfaces)
  set_tests_properties(mutated_surfaces PROPERTIES PROCESSORS 2)
endif()

# What runs under the sanitizers in CI: for addresses every layer's own tests and the contract's, not the long passes over real meshes
# nor the command line, which takes longer to compile than all layers; for threads the tests of what runs on several.
set(sanitized_areas base gl mesh mirror check_surface extend_fields compare plane split read software raster_plan raster_run device registry brick refine wish schedule pool seams surface measure extend ray_cast mesh_cast
  contract_format contract_test hard_cases perturbed vdb image scene slice library cache)
if(TESSERA_SANITIZE MATCHES thread)
  set(sanitized_areas base gl_test check_surface compare software contract_test brick_store refine schedule seams measure)
endif()
list(JOIN sanitized_areas "|" sanitized_areas)
get_property(tests_here DIRECTORY PROPERTY TESTS)
list(FILTER tests_here INCLUDE REGEX "^(${sanitized_areas})[a-z_]*$")
set(sanitized_programs "")
foreach(test IN LISTS tests_here)
  if(TARGET ${test})
    list(APPEND sanitized_programs ${test})
    set_property(TEST ${test} APPEND PROPERTY LABELS sanitized)
  endif()
endforeach()
add_custom_target(sanitized_tests DEPENDS ${sanitized_programs})
if(TARGET tessera)
  # It sends signals in the middle of a run, so nothing else should slow that run down.
  set_tests_properties(app_test.Interruption PROPERTIES RUN_SERIAL ON)
endif()
