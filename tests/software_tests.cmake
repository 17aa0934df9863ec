tessera_test(software_test FOLDER software OPTIMISED LINK software registry)
target_link_libraries(software_test PRIVATE PkgConfig::HWY)
tessera_test(flat_elements_test FOLDER software OPTIMISED LINK software reference)
tessera_test(registry_test FOLDER software LINK registry)
