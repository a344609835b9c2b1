# SPDX-License-Identifier: BSD-3-Clause

# What `cmake --install` and CPack put where. Component `runtime` is the program
# with its documentation, `dev` the libraries. The program is installed as
# colmap-adasfm, so that it can stand beside another `colmap`; for those who want
# one `colmap` with everything, lib/adasfm/bin/colmap is a link to it, in a folder
# to put first on the PATH.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(layers core sensors global partition synthetic)
set(adasfm_cmake_dir ${CMAKE_INSTALL_LIBDIR}/cmake/adasfm)

# --- dev: libraries, headers, CMake package
foreach(layer ${layers})
  set_target_properties(adasfm_${layer} PROPERTIES EXPORT_NAME ${layer})
  install(TARGETS adasfm_${layer} EXPORT adasfm-targets
          ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT dev)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/${layer}
          DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/adasfm COMPONENT dev
          FILES_MATCHING PATTERN "*.h")
endforeach()
install(EXPORT adasfm-targets NAMESPACE adasfm:: COMPONENT dev
        DESTINATION ${adasfm_cmake_dir})
configure_package_config_file(
  ${CMAKE_CURRENT_LIST_DIR}/adasfm-config.cmake.in
  ${PROJECT_BINARY_DIR}/adasfm-config.cmake
  INSTALL_DESTINATION ${adasfm_cmake_dir})
write_basic_package_version_file(
  ${PROJECT_BINARY_DIR}/adasfm-config-version.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/adasfm-config.cmake
              ${PROJECT_BINARY_DIR}/adasfm-config-version.cmake
        DESTINATION ${adasfm_cmake_dir} COMPONENT dev)

if(NOT TARGET adasfm_launcher)
  return()
endif()
set_target_properties(adasfm_colmap_ext PROPERTIES EXPORT_NAME colmap_ext)
install(TARGETS adasfm_colmap_ext EXPORT adasfm-colmap-targets
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT dev)
install(EXPORT adasfm-colmap-targets NAMESPACE adasfm:: COMPONENT dev
        DESTINATION ${adasfm_cmake_dir})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/colmap_ext
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/adasfm COMPONENT dev
        FILES_MATCHING PATTERN "*.h")

# --- runtime: the program, its manual, completion and documentation
install(PROGRAMS $<TARGET_FILE:adasfm_launcher>
        DESTINATION ${CMAKE_INSTALL_BINDIR} RENAME colmap-adasfm
        COMPONENT runtime)
# A renamed program is no target to install, so CPack does not strip it itself.
find_program(ADASFM_STRIP NAMES strip)
mark_as_advanced(ADASFM_STRIP)
install(CODE "
  if(CMAKE_INSTALL_DO_STRIP AND NOT \"${ADASFM_STRIP}\" STREQUAL \"\")
    execute_process(COMMAND \"${ADASFM_STRIP}\" --strip-unneeded
      --remove-section=.comment \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_BINDIR}/colmap-adasfm\")
  endif()" COMPONENT runtime)
set(launcher_link ${PROJECT_BINARY_DIR}/install/colmap)
file(MAKE_DIRECTORY ${PROJECT_BINARY_DIR}/install)
file(RELATIVE_PATH link_target
     ${CMAKE_INSTALL_FULL_LIBDIR}/adasfm/bin
     ${CMAKE_INSTALL_FULL_BINDIR}/colmap-adasfm)
file(CREATE_LINK ${link_target} ${launcher_link} SYMBOLIC)
install(FILES ${launcher_link}
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/adasfm/bin COMPONENT runtime)

find_package(Python3 REQUIRED COMPONENTS Interpreter)
set(man_folder ${PROJECT_BINARY_DIR}/install/man1)
set(man_page ${man_folder}/colmap-adasfm.1.gz)
add_custom_command(
  OUTPUT ${man_page}
  COMMAND Python3::Interpreter ${PROJECT_SOURCE_DIR}/packaging/make_man_page.py
          $<TARGET_FILE:adasfm_launcher> ${PROJECT_VERSION} ${man_folder}
  DEPENDS adasfm_launcher ${PROJECT_SOURCE_DIR}/packaging/make_man_page.py
          ${PROJECT_SOURCE_DIR}/packaging/command_help.py
  COMMENT "Writing the manual pages from the commands' own help")
add_custom_target(adasfm_man_page ALL DEPENDS ${man_page})
install(DIRECTORY ${man_folder} DESTINATION ${CMAKE_INSTALL_MANDIR}
        COMPONENT runtime)
install(FILES ${PROJECT_SOURCE_DIR}/packaging/colmap-adasfm.bash
        DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions
        RENAME colmap-adasfm COMPONENT runtime)
set(doc_dir ${CMAKE_INSTALL_DATADIR}/doc/colmap-adasfm)
install(FILES README.md CHANGELOG.md CITATION.cff DESTINATION ${doc_dir}
        COMPONENT runtime)
install(DIRECTORY docs DESTINATION ${doc_dir} COMPONENT runtime)
if(EXISTS ${PROJECT_SOURCE_DIR}/scripts/adasfm.sh)
  install(PROGRAMS scripts/adasfm.sh DESTINATION ${doc_dir}/examples
          COMPONENT runtime)
endif()

# --- both packages: licence and Debian's changelog
# Debian's form: the licence's text indented, its blank lines as dots.
file(READ LICENSE license_text)
string(REGEX REPLACE "\n\n" "\n.\n" license_text "${license_text}")
string(REGEX REPLACE "\n([^\n])" "\n \\1" license_text "\n${license_text}")
configure_file(packaging/copyright.in ${PROJECT_BINARY_DIR}/install/copyright
               @ONLY)
set(ADASFM_PACKAGE_CONTACT
    "The AdaSfM for COLMAP authors <maintainers@adasfm.invalid>"
    CACHE STRING "Maintainer of the packages: name <address>")
foreach(package colmap-adasfm libadasfm-dev)
  set(changelog ${PROJECT_BINARY_DIR}/install/${package})
  file(MAKE_DIRECTORY ${changelog})
  configure_file(packaging/changelog.in ${changelog}/changelog @ONLY)
  # -n: no time stamp, so that the same text is the same file.
  execute_process(COMMAND gzip -9nf ${changelog}/changelog
                  RESULT_VARIABLE result)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "gzip cannot pack ${changelog}/changelog")
  endif()
endforeach()
foreach(component runtime dev)
  set(package colmap-adasfm)
  if(component STREQUAL dev)
    set(package libadasfm-dev)
  endif()
  install(FILES ${PROJECT_BINARY_DIR}/install/copyright
                ${PROJECT_BINARY_DIR}/install/${package}/changelog.gz
          DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package}
          COMPONENT ${component})
endforeach()

# --- CPack: colmap-adasfm_*.deb and libadasfm-dev_*.deb
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME adasfm)
set(CPACK_PACKAGE_VENDOR "AdaSfM")
set(CPACK_PACKAGE_CONTACT "${ADASFM_PACKAGE_CONTACT}")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL runtime dev)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_NAME colmap-adasfm)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SHLIBDEPS ON)
# What the program loads itself: libopencv_imgcodecs.so.406 is in the package
# libopencv-imgcodecs406.
string(REPLACE ".so." "" imgcodecs_package "${ADASFM_IMGCODECS}")
string(REPLACE "_" "-" imgcodecs_package "${imgcodecs_package}")
set(CPACK_DEBIAN_RUNTIME_PACKAGE_DEPENDS ${imgcodecs_package})
set(CPACK_DEBIAN_RUNTIME_PACKAGE_RECOMMENDS colmap)
set(CPACK_COMPONENT_RUNTIME_DESCRIPTION
  "The adasfm_* commands: photos, and the logs of an IMU and wheels, to one
metric model. Priors from sensor logs, coarse global SfM and partitioned
mapping on ordinary COLMAP databases. Goes beside the package colmap.")
set(CPACK_DEBIAN_DEV_PACKAGE_NAME libadasfm-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS
  "libeigen3-dev, libceres-dev, libyaml-cpp-dev, libmetis-dev, libopencv-dev, libsqlite3-dev, liblz4-dev, libzstd-dev, nlohmann-json3-dev")
set(CPACK_COMPONENT_DEV_DESCRIPTION
  "Libraries, headers and a CMake package: sensor fusion, rotation and
translation averaging and graph partition for Structure from Motion.")
include(CPack)
