tessera_test(software_test FOLDER software OPTIMISED LINK software registry)
tessera_test(registry_test FOLDER software LINK registry)
