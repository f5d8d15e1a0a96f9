"""Which of the sensors of a recording go onto a flight, and how their clocks stand."""
