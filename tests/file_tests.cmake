if(TESSERA_BUILD_IO)
  # One program, compiled as one source: OpenVDB's templates cost more than all the rest.
  tessera_test(vdb_test FOLDER vdb SOURCES vdb/vdb_flat_test.cpp vdb/vdb_failure_test.cpp vdb/vti_test.cpp
    LINK vdb PRIVATE_LINK tessera_openvdb VTK::CommonCore VTK::CommonDataModel VTK::CommonExecutionModel VTK::IOXML)
  set_target_properties(vdb_test PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 0)
  if(TESSERA_SANITIZE MATCHES undefined)
    target_compile_options(vdb_test PRIVATE -fno-sanitize=undefined)  # as in src/vdb
  endif()
  tessera_test(vdb_metadata_test FOLDER vdb LINK vdb)
  tessera_test(stored_bricks_test FOLDER pool OPTIMISED LINK pool vdb software)
  tessera_test(pool_data_test FOLDER pool OPTIMISED LINK pool reader software)
  tessera_test(library_test FOLDER library LINK library reference)
  tessera_test(job_test FOLDER job LINK job)
  tessera_test(cache_test FOLDER cache LINK cache software)
  tessera_test(nvdb_test FOLDER vdb LINK vdb PRIVATE_LINK tessera_nanovdb)
  # The fuzz targets over their stored inputs, by this compiler and without libFuzzer.
  foreach(name fuzz_tetgen fuzz_vdb_metadata fuzz_report_json fuzz_assemble_mesh fuzz_netcdf_check)
    tessera_program(replay_${name} SOURCES fuzz/replay.cpp fuzz/${name}.cpp LINK reader vdb)
    add_test(NAME replay_${name} COMMAND replay_${name} ${CMAKE_CURRENT_SOURCE_DIR}/fuzz/corpus/${name})
  endforeach()
  tessera_test(slice_renderer_test FOLDER render OPTIMISED LINK render reference pictures software)
  tessera_test(image_test FOLDER pictures LINK pictures PRIVATE_LINK PNG::PNG)
  tessera_test(image_exr_test FOLDER pictures LINK pictures registry reference PRIVATE_LINK PkgConfig::OPENEXR)
endif()
