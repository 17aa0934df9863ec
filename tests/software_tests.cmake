tessera_test(software_test FOLDER software OPTIMISED LINK software registry)
target_link_libraries(software_test PRIVATE PkgConfig::HWY)
tessera_test(registry_test FOLDER software LINK registry)
