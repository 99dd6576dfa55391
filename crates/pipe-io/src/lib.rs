//! Images, volumes and tables between files and host memory.
