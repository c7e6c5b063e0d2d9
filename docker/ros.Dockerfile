# ROS 2 with the interfaces of GOLEM and the DDS that GOLEM speaks. Nav2, RViz, FAST-LIO: add what you want, below.
#   docker build -f docker/ros.Dockerfile -t golem-ros .
# Another distribution: --build-arg BASE=ros:humble-ros-base --build-arg DISTRO=humble
ARG BASE=ros:jazzy-ros-base@sha256:31daab66eef9139933379fb67159449944f4e2dcf2e22c2d12cc715f29873e0f
FROM ${BASE}
ARG DISTRO=jazzy
RUN apt-get update \
    && apt-get install -y --no-install-recommends ros-${DISTRO}-rmw-cyclonedds-cpp \
    && rm -rf /var/lib/apt/lists/*
# Yours, e.g. ros-${DISTRO}-navigation2 ros-${DISTRO}-nav2-bringup ros-${DISTRO}-rviz2; or a workspace of your own.

COPY ros/golem_interfaces /opt/golem/src/golem_interfaces
RUN . /opt/ros/${DISTRO}/setup.sh \
    && cd /opt/golem \
    && colcon build --merge-install --packages-select golem_interfaces \
    && rm -rf build log
COPY docker/cyclonedds.xml docker/ros_entrypoint.sh /opt/golem/
RUN useradd --create-home golem
ENV RMW_IMPLEMENTATION=rmw_cyclonedds_cpp CYCLONEDDS_URI=file:///opt/golem/cyclonedds.xml ROS_DOMAIN_ID=1
USER golem
WORKDIR /home/golem
ENTRYPOINT ["/bin/bash", "/opt/golem/ros_entrypoint.sh"]
CMD ["bash"]
