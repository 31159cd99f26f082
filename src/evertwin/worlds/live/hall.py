"""The hall in which the robot drives: walls, clutter, tables on legs."""

from __future__ import annotations

SCENE = """
<mujoco><option timestep="0.005" integrator="implicitfast"/>
<worldbody><geom type="plane" size="50 50 .1"/>
<body name="base" pos="0 0 0.1"><joint name="x" type="slide" axis="1 0 0"/>
<joint name="y" type="slide" axis="0 1 0"/><joint name="heading" type="hinge" axis="0 0 1"/>
<geom type="cylinder" size=".2 .1" mass="20" contype="0" conaffinity="0"/></body>
</worldbody></mujoco>
"""
