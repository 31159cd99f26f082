"""Embedded machines that live: they run in real time or in time-lapse, and speak.

``python -m evertwin.worlds.live arm`` speaks Modbus TCP and OPC UA, ``… robot`` speaks MQTT. While
they run they can be told to wear, to carry a load, to lie with a sensor, to be pushed, to lose a
cable (`evertwin.worlds.live.orders`).

    physics ─► sensors with their faults ─► sample with stamp and number ─► Modbus, OPC UA, MQTT
                          ▲
                orders (loopback): payload=2 friction.3=1.3 bias.tau2=4 cut.modbus=1 for=20
"""
