tessera_test(compare_test LINK compare reference registry)
