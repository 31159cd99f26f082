"""A mass on a rail with viscous and dry friction, in the languages of other tools."""

MODELICA = """model Mass
  parameter Real mass(unit="kg", min=0.1, max=50) = 2.0;
  parameter Real fc(unit="N", min=0, max=50) = 1.5;
  parameter Real fv(unit="N.s/m", min=0, max=50) = 0.5;
  input Real force(unit="N");
  output Real x(unit="m");
  output Real v(unit="m/s");
equation
  der(x) = v;
  mass * der(v) = force - fc * tanh(v / 0.01) - fv * v;
end Mass;
"""
MUJOCO = """<mujoco><option timestep="{step}" gravity="0 0 0"/><worldbody><body name="cart">
  <joint name="rail" type="slide" axis="1 0 0" damping="0.5" frictionloss="1.5"/>
  <geom size=".1" mass="2"/></body></worldbody>
  <actuator><motor name="force" joint="rail"/></actuator></mujoco>"""
KNOBS = ["body.cart.mass", "joint.rail.damping", "joint.rail.frictionloss"]
"""Parameters of the MuJoCo model."""
