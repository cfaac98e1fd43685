"""What benches compare: native Embree, embreex, trimesh, wp.mesh_query_ray and wive."""
