"""The damaged portion of an attacked sensor."""
