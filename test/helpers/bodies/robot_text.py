"""A robot description with every kind of joint and shape that needs no file."""

ROBOT = """<?xml version="1.0"?>
<robot name="arm">
  <material name="steel"><color rgba="0.2 0.4 0.6 1"/></material>
  <link name="base">
    <inertial><mass value="1"/></inertial>
    <visual><origin xyz="0 0 0.05"/><geometry><box size="0.3 0.2 0.1"/></geometry><material name="steel"/></visual>
    <collision><geometry><sphere radius="9"/></geometry></collision>
  </link>
  <joint name="turntable" type="continuous">
    <parent link="base"/><child link="column"/><origin xyz="0 0 0.1" rpy="0.1 -0.2 0.3"/><axis xyz="0 0 2"/>
  </joint>
  <link name="column">
    <visual name="tube"><geometry><cylinder radius="0.05" length="0.4"/></geometry>
      <material name="paint"><color rgba="1 0 0 0.5"/></material></visual>
    <visual><origin rpy="0 1.5 0"/><geometry><sphere radius="0.07"/></geometry><material name="paint"/></visual>
  </link>
  <joint name="lift" type="prismatic">
    <parent link="column"/><child link="carriage"/><axis xyz="0 0 1"/><limit lower="0.1" upper="0.5" effort="1" velocity="1"/>
  </joint>
  <link name="carriage"/>
  <joint name="elbow" type="revolute">
    <parent link="carriage"/><child link="forearm"/><origin xyz="0.1 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-0.5" upper="2" effort="1" velocity="1"/><dynamics damping="1"/>
  </joint>
  <link name="forearm"><visual><geometry><capsule radius="0.03" length="0.3"/></geometry></visual></link>
  <joint name="stuck" type="revolute"><parent link="forearm"/><child link="tool"/><limit effort="1" velocity="1"/></joint>
  <link name="tool"/>
  <transmission name="ignored"/><gazebo reference="base"/>
</robot>
"""
