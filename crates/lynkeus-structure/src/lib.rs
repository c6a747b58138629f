//! What can be observed: chains, and conditions decided on the declared box.
