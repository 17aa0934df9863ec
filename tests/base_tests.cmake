tessera_test(base_test LINK base)
