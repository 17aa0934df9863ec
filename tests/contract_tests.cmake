add_library(contract_suite STATIC contract/contract_suite.cpp contract/contract_cases.cpp contract/oracle_resampler.cpp contract/quantised_resampler.cpp)
target_link_libraries(contract_suite PUBLIC tessera_reference GTest::gtest PRIVATE tessera_flags)
target_include_directories(contract_suite PUBLIC ${CMAKE_CURRENT_SOURCE_DIR}/contract ${CMAKE_CURRENT_SOURCE_DIR})
tessera_precompile(contract_suite)

tessera_test(oracle_test FOLDER contract OPTIMISED LINK reference)
tessera_test(contract_checker_test FOLDER contract LINK reference PRIVATE_LINK contract_suite)
tessera_test(contract_format_test FOLDER contract LINK reference software PRIVATE_LINK contract_suite)
tessera_test(contract_test FOLDER contract LINK reference registry PRIVATE_LINK contract_suite)
tessera_test(contract_random_test FOLDER contract LINK reference registry PRIVATE_LINK contract_suite)
set(contract_tests oracle_test contract_checker_test contract_format_test contract_test contract_random_test)
if(TARGET tessera_vdb)
  tessera_test(contract_data_test FOLDER contract LINK reference registry reader PRIVATE_LINK contract_suite)
  list(APPEND contract_tests contract_data_test)
endif()
set_tests_properties(${contract_tests} PROPERTIES TIMEOUT 900)

# The OpenGL resamplers run as tests of their own beside the others of the same programs: they take longer, and
# thread sanitizers have no place for their drivers. An emulated device takes many minutes for all points and cases, so it is a fiftieth of them;
# run the program itself for the whole.
function(tessera_split_device_tests)
  set(others "")
  foreach(name Slicing Hybrid Compute)
    string(TOLOWER ${name} algorithm)
    if(TARGET tessera_${algorithm})
      list(APPEND others "*${name}*")
      foreach(program IN LISTS ARGN)
        if(NOT TESSERA_SANITIZE MATCHES thread)
          add_test(NAME ${program}.${algorithm} COMMAND ${program} --gtest_filter=*${name}*)
          set_tests_properties(${program}.${algorithm} PROPERTIES TIMEOUT 1800 COST 1000 ENVIRONMENT TESSERA_CONTRACT_SCALE=0.02)
        endif()
      endforeach()
    endif()
  endforeach()
  list(JOIN others ":" others)
  set_tests_properties(${ARGN} PROPERTIES ENVIRONMENT "GTEST_FILTER=-${others}")
endfunction()

set(on_devices contract_test contract_random_test)
if(TARGET contract_data_test)
  list(APPEND on_devices contract_data_test)
endif()
tessera_split_device_tests(${on_devices})
if(TESSERA_SANITIZE MATCHES address)
  # One mesh of each kind: what a case adds in arithmetic is checked in the release build, as are the same bits always.
  set(cases "")
  foreach(mesh TurnedJitteredBox BoxFarFromTheOrigin GradedDelaunay TurnedBoundaryLayers ThinTetsOfAspect1e12 NeedleClusterOfAspect1e10
               TetsWithIntegerNodes OverlappingTets FlatAndInvertedElements ManyElementsInOneVoxel HangingNodes TurnedStackedBoxes
               ElementsOfSizesFarApart TurnedPlateFarThinnerThanAVoxel)
    list(APPEND cases "*WrongValues/Software*On${mesh}")
  endforeach()
  list(JOIN cases ":" cases)
  set_tests_properties(contract_test PROPERTIES ENVIRONMENT "GTEST_FILTER=${cases}:*ContractOf*Software*")
elseif(TESSERA_SANITIZE MATCHES thread)
  # What runs on several threads; the oracle doesn't.
  set_tests_properties(contract_test PROPERTIES
    ENVIRONMENT "GTEST_FILTER=*SameBits*/Software*JitteredBox:*SameBits*/Software*GradedDelaunay:*SameBits*/Software*ThinTets*")
endif()
