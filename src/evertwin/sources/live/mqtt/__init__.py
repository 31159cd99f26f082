"""MQTT: messages of a broker, acknowledged once their rows are kept."""
