from .page import page, save

__all__ = ["page", "save"]
