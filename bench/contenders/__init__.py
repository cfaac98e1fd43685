"""What benches race: native Embree, embreex, trimesh, wp.mesh_query_ray, and wive itself."""
