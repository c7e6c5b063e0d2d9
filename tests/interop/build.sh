#!/usr/bin/env bash
# Usage: tests/interop/build.sh jazzy|kilted
#
# Makes .cache/interop/DISTRO: ROS 2 from wheels, with our interfaces built for Python by rosidl as a user's colcon would.
# Where a checkout of rmw_cyclonedds is named and Cyclone's 0.10 headers are there, its library is built beside the
# Fast DDS that the wheels bring:
#   apt-get install cyclonedds-dev; git clone -b jazzy https://github.com/ros2/rmw_cyclonedds
#   GOLEM_RMW_CYCLONEDDS=path/to/rmw_cyclonedds tests/interop/build.sh jazzy
# Exits with 3, and a reason, where CPython 3.12, the wheels or a compiler cannot be had.
set -euo pipefail
distro=$1
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
prefix=$root/.cache/interop/$distro
lock=$here/requirements-$distro.txt

cannot() {
    echo "$1" >&2
    exit 3
}

python=""
for candidate in python3.12 "$(PYENV_VERSION=3.12 python3.12 -c 'import sys; print(sys.executable)' 2> /dev/null || true)" \
    "$(uv python find 3.12 2> /dev/null || true)"; do
    if [ -n "$candidate" ] && "$candidate" -c '' 2> /dev/null; then
        python=$candidate
        break
    fi
done
[ -n "$python" ] || cannot "needs CPython 3.12, for which the wheels of ROS 2 are made"
command -v cmake > /dev/null && command -v g++ > /dev/null || cannot "needs cmake and g++ to build the interfaces"

sum=$(cat "$lock" "$0" "$here"/CMakeLists.txt <(find "$root/ros/" -type f | sort | xargs cat) | cksum)
if [ "$sum" != "$(cat "$prefix/.interfaces" 2> /dev/null)" ]; then
    rm -rf "$prefix"
    mkdir -p "$(dirname "$prefix")"
    "$python" -m venv "$prefix"
    "$prefix/bin/python" -m pip install --quiet --disable-pip-version-check --require-hashes -r "$lock" ||
        cannot "needs the wheels of $lock"
    # Their CMake files name the Python that they were built with.
    built=/opt/python/cp312-cp312
    home=$("$python" -c 'import sys; print(sys.base_prefix)')
    grep -rl --include='*.cmake' "$built" "$prefix/share" "$prefix/lib" |
        xargs sed -i -e "s#$built/lib/python3.12/site-packages#$prefix/lib/python3.12/site-packages#g" -e "s#$built#$home#g"
    packages=$prefix/interfaces
    for package in golem_interfaces livox_ros_driver2 nav2_msgs unitree_api unitree_go unitree_hg; do
        mkdir -p "$packages"
        cp -rL "$root/ros/$package" "$packages/$package"
    done
    mkdir -p "$packages/tf2_msgs/msg"  # the only standard package that the wheels lack
    echo "geometry_msgs/TransformStamped[] transforms" > "$packages/tf2_msgs/msg/TFMessage.msg"
    for package in "$packages"/*; do
        name=$(basename "$package")
        cp "$here/CMakeLists.txt" "$package"
        [ -f "$package/package.xml" ] ||
            sed "s/golem_interfaces/$name/" "$root/ros/golem_interfaces/package.xml" > "$package/package.xml"
        # The wheels' own start-up puts their libraries on the path of every Python of theirs.
        cmake -S "$package" -B "$prefix/build/$name" -DPACKAGE="$name" -DCMAKE_INSTALL_PREFIX="$prefix" \
            -DCMAKE_PREFIX_PATH="$prefix" -DPython3_EXECUTABLE="$prefix/bin/python" -DPython3_FIND_VIRTUALENV=ONLY \
            -DPYTHON_EXECUTABLE="$prefix/bin/python" -DBUILD_TESTING=OFF \
            -DCMAKE_CXX_FLAGS=-O0 -DCMAKE_C_FLAGS=-O0
        cmake --build "$prefix/build/$name" --target install --parallel 2
    done
    echo "$sum" > "$prefix/.interfaces"
fi

source=${GOLEM_RMW_CYCLONEDDS:-}
if [ -n "$source" ] && [ ! -e "$prefix/cyclone/librmw_fastrtps_cpp.so" ]; then
    cmake -S "$source/rmw_cyclonedds_cpp" -B "$prefix/build/rmw" -DCMAKE_INSTALL_PREFIX="$prefix" \
        -DCMAKE_PREFIX_PATH="$prefix" -DPython3_EXECUTABLE="$prefix/bin/python" -DBUILD_TESTING=OFF
    cmake --build "$prefix/build/rmw" --target install
    # The wheels' rclpy is linked to Fast DDS's library by name: a folder in front of it gives that name to Cyclone's.
    mkdir -p "$prefix/cyclone"
    ln -sf ../lib/librmw_cyclonedds_cpp.so "$prefix/cyclone/librmw_fastrtps_cpp.so"
fi
