// Makes completion scripts for shells and a man page from the description of the command line.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace handsim::app {

/// A script that completes commands, options and their words. @param shell bash, zsh or fish.
std::string completion_script(const CLI::App& app, const std::string& shell);

/// handsim(1) in the man macros of roff.
std::string man_page(const CLI::App& app, const std::string& version);

}  // namespace handsim::app
