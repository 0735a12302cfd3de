"""The validation drive: a rover follows a path in the exported scene, in MuJoCo."""
