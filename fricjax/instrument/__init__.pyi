__all__ = ["ImpactTest", "Interferometer", "impact_test", "refractive_index", "synthetic_run", "white_acceleration"]
