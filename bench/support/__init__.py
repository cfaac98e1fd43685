"""What benches share: options, scenes, rays, timing, reports."""
