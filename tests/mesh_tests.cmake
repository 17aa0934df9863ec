tessera_test(mesh_test LINK mesh PRIVATE_LINK tessera_gmp)
