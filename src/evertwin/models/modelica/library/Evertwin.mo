package Evertwin "Parts of machines, smooth throughout, and machines made of them"

  connector Flange "Where a shaft ends"
    Real phi(unit = "rad") "Angle";
    flow Real tau(unit = "N.m") "Torque into the part";
  end Flange;

  model TorqueSource "What a drive puts on a shaft"
    Flange b;
    input Real torque(unit = "N.m");
  equation
    b.tau = -torque;
  end TorqueSource;

  model Motor "Direct-current motor with its rotor: voltage in, shaft out"
    Flange b;
    parameter Real J(unit = "kg.m2", min = 1e-9, max = 1e3) = 1e-3 "Rotor inertia";
    parameter Real k(unit = "N.m/A", min = 1e-6, max = 1e3) = 0.1 "Torque constant and back-EMF";
    parameter Real R(unit = "Ohm", min = 1e-6, max = 1e6) = 1.0 "Winding resistance";
    input Real voltage(unit = "V");
    Real current(unit = "A");
    Real speed(unit = "rad/s");
  equation
    der(b.phi) = speed;
    current = (voltage - k * speed) / R;
    J * der(speed) = k * current + b.tau;
  end Motor;

  model Inertia "Turning mass"
    Flange a;
    parameter Real J(unit = "kg.m2", min = 1e-9, max = 1e6) = 1.0 "Moment of inertia";
    Real speed(unit = "rad/s");
  equation
    der(a.phi) = speed;
    J * der(speed) = a.tau;
  end Inertia;

  partial model Rub "Gearbox with friction on its slow side"
    Flange a "Fast side";
    Flange b "Slow side";
    parameter Real ratio(min = 1e-3, max = 1e4) = 100.0 "Turns of a per turn of b";
    parameter Real Fv(unit = "N.m.s/rad", min = 0, max = 1e6) = 0.0 "Viscous friction";
    parameter Real Fc(unit = "N.m", min = 0, max = 1e6) = 0.0 "Coulomb friction";
    parameter Real offset(unit = "N.m", min = -1e6, max = 1e6) = 0.0 "Constant torque";
    final parameter Real width(unit = "rad/s") = 0.02 "Speed at which the sign has reached 0.76";
    Real speed(unit = "rad/s");
    Real friction(unit = "N.m");
  equation
    a.phi = ratio * b.phi;
    der(b.phi) = speed;
    ratio * a.tau + b.tau = friction;
  end Rub;

  model Gearbox "Coulomb and viscous friction, the sign smoothed by tanh"
    extends Rub;
  equation
    friction = Fv * speed + offset + Fc * tanh(speed / width);
  end Gearbox;

  model StribeckGearbox "The same with the Stribeck peak"
    extends Rub;
    parameter Real Fs(unit = "N.m", min = 0, max = 1e6) = 0.0 "Stribeck peak";
    final parameter Real vs(unit = "rad/s") = 0.2 "Speed at which the peak has fallen to 1/e";
  equation
    friction = Fv * speed + offset + tanh(speed / width) * (Fc + Fs * exp(-(speed / vs) ^ 2));
  end StribeckGearbox;

  model ElasticJoint "Spring and damper in a shaft"
    Flange a;
    Flange b;
    parameter Real stiffness(unit = "N.m/rad", min = 1e-3, max = 1e9) = 1e4;
    parameter Real damping(unit = "N.m.s/rad", min = 0, max = 1e6) = 1.0;
    Real torque(unit = "N.m");
  equation
    torque = stiffness * (a.phi - b.phi) + damping * (der(a.phi) - der(b.phi));
    a.tau = torque;
    b.tau = -torque;
  end ElasticJoint;

  model Axis "Torque on a gearbox with tanh friction, and a load"
    input Real torque(unit = "N.m") "At the motor";
    output Real q(unit = "rad") "Angle of the load";
    output Real v(unit = "rad/s") "Its speed";
    TorqueSource source(torque = torque);
    Inertia rotor(J = 1e-3);
    Gearbox gearbox(Fv = 2.0, Fc = 6.0);
    Inertia load(J = 2.0);
  equation
    connect(source.b, rotor.a);
    connect(rotor.a, gearbox.a);
    connect(gearbox.b, load.a);
    q = load.a.phi;
    v = load.speed;
  end Axis;

  model StribeckAxis "The same with the Stribeck peak"
    input Real torque(unit = "N.m");
    output Real q(unit = "rad");
    output Real v(unit = "rad/s");
    TorqueSource source(torque = torque);
    Inertia rotor(J = 1e-3);
    StribeckGearbox gearbox(Fv = 2.0, Fc = 6.0, Fs = 3.0);
    Inertia load(J = 2.0);
  equation
    connect(source.b, rotor.a);
    connect(rotor.a, gearbox.a);
    connect(gearbox.b, load.a);
    q = load.a.phi;
    v = load.speed;
  end StribeckAxis;

  model MotorAxis "Motor, gearbox, elastic joint, load: voltage in, current and motion out"
    input Real voltage(unit = "V");
    output Real q(unit = "rad") "Angle of the load";
    output Real v(unit = "rad/s") "Its speed";
    output Real current(unit = "A") "Of the motor";
    Motor motor;
    Gearbox gearbox(Fv = 2.0, Fc = 6.0);
    ElasticJoint joint;
    Inertia load(J = 2.0);
  equation
    connect(motor.b, gearbox.a);
    connect(gearbox.b, joint.a);
    connect(joint.b, load.a);
    motor.voltage = voltage;
    q = load.a.phi;
    v = load.speed;
    current = motor.current;
  end MotorAxis;

  model ThermalBox "Heated box with a heater that stores heat; the room around it"
    parameter Real heater_power(unit = "W", min = 0, max = 1e6) = 120.0;
    parameter Real heater_capacity(unit = "J/K", min = 1e-3, max = 1e7) = 50.0;
    parameter Real heater_conductance(unit = "W/K", min = 1e-4, max = 1e4) = 1.0;
    parameter Real box_capacity(unit = "J/K", min = 1e-1, max = 1e8) = 400.0;
    parameter Real box_conductance(unit = "W/K", min = 1e-4, max = 1e4) = 0.7;
    parameter Real heater_start(unit = "K", min = 200, max = 800) = 293.15;
    input Real heater(min = 0, max = 1) "Share of its power";
    input Real room(unit = "K", min = 150, max = 1500);
    output Real box(unit = "K", min = 150, max = 1500, start = heater_start);
    Real hot(unit = "K", start = heater_start) "Temperature of the heater";
    Real heat(unit = "W");
  equation
    heat = heater_conductance * (hot - box);
    heater_capacity * der(hot) = heater_power * heater - heat;
    box_capacity * der(box) = heat - box_conductance * (box - room);
  end ThermalBox;

  model Joint "One joint of a machine: torque in, motion out"
    parameter Real J(unit = "kg.m2", min = 1e-9, max = 1e6) = 1.0 "Inertia at the joint";
    parameter Real Fv(unit = "N.m.s/rad", min = 0, max = 1e6) = 1.0 "Viscous friction";
    parameter Real Fc(unit = "N.m", min = 0, max = 1e6) = 1.0 "Coulomb friction";
    final parameter Real width(unit = "rad/s") = 0.02;
    input Real torque(unit = "N.m");
    Real q(unit = "rad");
    Real v(unit = "rad/s");
  equation
    der(q) = v;
    J * der(v) = torque - Fv * v - Fc * tanh(v / width);
  end Joint;

  model SixJoints "Six joints as an array"
    input Real torque[6](each unit = "N.m");
    output Real q[6](each unit = "rad");
    output Real v[6](each unit = "rad/s");
    Joint joint[6](
      J = {3.0, 3.0, 1.5, 0.4, 0.3, 0.1},
      Fv = {9.0, 9.0, 5.0, 2.0, 2.0, 1.0},
      Fc = {12.0, 12.0, 8.0, 3.0, 3.0, 2.0});
  equation
    for i in 1:6 loop
      joint[i].torque = torque[i];
      q[i] = joint[i].q;
      v[i] = joint[i].v;
    end for;
  end SixJoints;

end Evertwin;
