tessera_test(compare_test FOLDER compare LINK compare reference registry)
