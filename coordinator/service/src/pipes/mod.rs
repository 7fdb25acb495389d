//! What a service and the process of a job tell each other, over two pipes.
//!
//! | module | what lives there |
//! |---|---|
//! | `messages` | the messages |
//! | `frames` | how they are written and read |
//! | `link` | previews asked for, and what comes of it |

mod frames;
mod link;
pub mod messages;

pub use frames::{Outlet, receive};
pub use link::JobLink;
