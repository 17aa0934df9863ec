tessera_test(software_test LINK software registry)
