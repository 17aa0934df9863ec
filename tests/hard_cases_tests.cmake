add_library(hard_cases STATIC hard_cases/hard_meshes.cpp hard_cases/hard_cases.cpp hard_cases/perturbed_cases.cpp)
target_link_libraries(hard_cases PUBLIC contract_suite tessera_registry PRIVATE tessera_flags)
tessera_precompile(hard_cases)

tessera_test(hard_cases_test FOLDER hard_cases OPTIMISED LINK reference registry PRIVATE_LINK hard_cases)
tessera_test(perturbed_cases_test FOLDER hard_cases LINK reference registry PRIVATE_LINK hard_cases)
tessera_test(repair_hard_cases_test FOLDER hard_cases LINK reference registry PRIVATE_LINK hard_cases)
set_tests_properties(repair_hard_cases_test hard_cases_test perturbed_cases_test PROPERTIES TIMEOUT 900)
tessera_split_device_tests(hard_cases_test perturbed_cases_test)
if(TESSERA_SANITIZE MATCHES address)
  # The bits must be the same here; the contract at every point is checked in the release build.
  set_tests_properties(hard_cases_test PROPERTIES ENVIRONMENT "GTEST_FILTER=*HardCaseHashes*:HardCaseList*")
endif()
if(TARGET bench_arguments)
  tessera_program(accuracy_table SOURCES hard_cases/accuracy_table.cpp
    LINK reference registry PRIVATE_LINK hard_cases bench_arguments fmt::fmt GTest::gtest)
endif()
