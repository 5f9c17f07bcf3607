"""Environments of dynx beside Gymnasium's: equal steps (`exactness`) and their speed (`speed`)."""
