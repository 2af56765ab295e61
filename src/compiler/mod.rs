//! Program -> decision -> intervention for one scene.
