tessera_test(software_test OPTIMISED LINK software registry)
tessera_test(registry_test LINK registry)
