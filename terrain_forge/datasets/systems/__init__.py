"""Calibration in the words of SLAM systems, a module for those that share a form."""
