tessera_test(software_test LINK software registry)
tessera_test(registry_test LINK registry)
