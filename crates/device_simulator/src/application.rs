//! What a device does with its process data: the part behind the controller.

use crate::al_status_code::AlStatusCode;
use crate::mailbox::Emergency;
use crate::object_dictionary::{Abort, Key, ObjectDictionary};

/// The application of a device. Process data reach it as objects of its dictionary.
pub trait Application {
    /// Time goes on to `now` \[ns\].
    fn advance(&mut self, dictionary: &mut ObjectDictionary, now: u64);

    /// Outputs have been taken over, in OP, at SYNC0 or as they came.
    fn outputs(&mut self, dictionary: &mut ObjectDictionary, now: u64);

    /// Inputs are about to be read, in SAFEOP and OP.
    fn inputs(&mut self, dictionary: &mut ObjectDictionary, now: u64);

    /// The device left OP: outputs are to be safe. The code says why, if by an error.
    fn outputs_are_lost(
        &mut self,
        dictionary: &mut ObjectDictionary,
        now: u64,
        why: Option<AlStatusCode>,
    );

    /// The main device wrote an object by SDO.
    ///
    /// # Errors
    ///
    /// [`Abort`] where the value is refused; the object gets its old value back.
    fn written(&mut self, dictionary: &ObjectDictionary, key: Key) -> Result<(), Abort> {
        let _ = (dictionary, key);
        Ok(())
    }

    /// An emergency that is to be sent, if there is one.
    fn emergency(&mut self) -> Option<Emergency> {
        None
    }
}
