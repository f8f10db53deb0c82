"""Pictures through OpenCV: a live device or stream, or files that begin again at the end."""

from legato.drivers.opencv.camera import OpenCVCamera
from legato.drivers.opencv.settings import CameraSettings

__all__ = ["CameraSettings", "OpenCVCamera"]
