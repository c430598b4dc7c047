"""Rigid robot with wheels: variable table, module and kernels."""

from fmus.robot.module import Robot, robot_table

__all__ = ["Robot", "robot_table"]
