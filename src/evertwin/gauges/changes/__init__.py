"""Since when a machine is another one, inputs as never before, and how a measurement scatters."""
