//! From a plant's equations and a few sensors to estimates of what nobody measures.
