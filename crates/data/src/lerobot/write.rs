//! Writes LeRobot data sets.
