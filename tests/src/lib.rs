//! Golden and end-to-end tests of pipe.
