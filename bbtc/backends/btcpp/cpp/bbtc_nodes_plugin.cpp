// Plugin with the nodes Skipper and Latch, for programs that load theirs at run time:
//   factory.registerFromPlugin("libbbtc_nodes.so");
#include "bbtc_nodes.hpp"

BT_REGISTER_NODES(factory) { bbtc::registerNodes(factory); }
