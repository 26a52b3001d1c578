#include <fmt/format.h>

#include "handsim/app/commands.h"
#include "handsim/app/progress.h"
#include "handsim/core/data_folder.h"
#include "handsim/output/atomic_file.h"
#include "handsim/study/contact_cost.h"

namespace handsim::app {

int contacts_command(const std::filesystem::path& out) {
  output::make_folder(out);
  std::vector<study::ContactCostRow> rows;
  {
    ProgressBar bar;
    rows = study::run_contact_cost(data_folder(), [&bar](double share) { bar.show(share); });
  }
  const bool plotted = study::write_contact_cost(rows, out);
  fmt::print("A hand on a stack of slabs, steps of 1 ms.\n\n{}\nfiles in {}{}\n",
             study::contact_cost_table(rows), out.string(),
             plotted ? "" : " (no plot: gnuplot is missing or failed; contacts_cost.gp is its script)");
  return 0;
}

}  // namespace handsim::app
