"""The digital twin on MuJoCo: engine, hoist, cameras."""
