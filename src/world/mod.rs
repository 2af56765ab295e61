//! The evaluator before rollout: features, predictor, calibrator, router.
