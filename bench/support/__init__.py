"""Modules that benches share: options, scenes, rays, timing, reports."""
