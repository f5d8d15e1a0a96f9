"""What instruments on a body in flight read: rows on its states, noise, bias and clock.

INSTRUMENTS is the table of them: whatever reads sensors goes through it.
"""

from forceid.flight.instruments.accelerometer import ACCELEROMETER as ACCELEROMETER
from forceid.flight.instruments.gyro import GYRO as GYRO
from forceid.flight.instruments.magnetometer import MAGNETOMETER as MAGNETOMETER

INSTRUMENTS = (GYRO, ACCELEROMETER, MAGNETOMETER)
