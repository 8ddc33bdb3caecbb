"""The stage that is not there: virtual CiA 402 drives and the mechanics behind them."""
