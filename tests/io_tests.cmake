if(TESSERA_BUILD_IO)
  tessera_test(vdb_file_test LINK io PRIVATE_LINK tessera_openvdb)
  tessera_test(image_test LINK io PRIVATE_LINK PNG::PNG)
endif()
