"""The commands of one twin: fit, run, doctor, report, validate, engineer, label, export."""
