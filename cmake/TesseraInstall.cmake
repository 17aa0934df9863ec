# `cmake --install`: the public headers under include/tessera/, static libraries, the command line and package files, so that another project can
# say find_package(Tessera) and link Tessera::tessera. Other targets in the package are what that one is made of.
include(CMakePackageConfigHelpers)

set(TESSERA_CMAKE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/Tessera)
get_property(layers GLOBAL PROPERTY TESSERA_LAYERS)
foreach(layer IN LISTS layers)
  install(TARGETS tessera_${layer} EXPORT TesseraTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
endforeach()
install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/tessera DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")
if(TARGET tessera)
  install(TARGETS tessera RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
  if(TARGET tessera_view_program)
    install(TARGETS tessera_view_program RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
  endif()
  if(TARGET tessera_tetrahedralize)
    install(TARGETS tessera_tetrahedralize RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
  endif()
  if(TARGET tessera_vtk_peer)
    install(TARGETS tessera_vtk_peer RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
  endif()
  install(TARGETS tessera_read_mesh RUNTIME DESTINATION ${CMAKE_INSTALL_LIBEXECDIR}/tessera)
endif()
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})

install(EXPORT TesseraTargets NAMESPACE Tessera:: DESTINATION ${TESSERA_CMAKE_DIR})
configure_package_config_file(cmake/TesseraConfig.cmake.in ${PROJECT_BINARY_DIR}/TesseraConfig.cmake
  INSTALL_DESTINATION ${TESSERA_CMAKE_DIR})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/TesseraConfigVersion.cmake COMPATIBILITY SameMinorVersion)
# The package file finds the same dependencies in the same order, so it runs the very file that the build runs.
install(FILES ${PROJECT_BINARY_DIR}/TesseraConfig.cmake ${PROJECT_BINARY_DIR}/TesseraConfigVersion.cmake
  cmake/TesseraDependencies.cmake DESTINATION ${TESSERA_CMAKE_DIR})
