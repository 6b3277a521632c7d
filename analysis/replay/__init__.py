"""Replay: logged inputs through controllers and estimators again, shadow and counterfactual."""
