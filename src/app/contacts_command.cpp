#include <fmt/format.h>

#include "handsim/app/commands.h"
#include "handsim/app/console.h"
#include "handsim/app/progress.h"
#include "handsim/app/study_repeat.h"
#include "handsim/core/data_folder.h"
#include "handsim/output/output_folder.h"
#include "handsim/study/effects/contact_cost.h"

namespace handsim::app {

int contacts_command(const ContactsArguments& arguments) {
  const std::filesystem::path& out = arguments.out;
  const output::OutputFolder folder(out, study::contact_cost_files());
  std::vector<study::ContactCostRow> rows;
  {
    ProgressBar bar;
    rows = study::run_contact_cost(data_folder(), [&bar](double share) { bar.show(share); });
  }
  folder.clear();
  const PlotNote note = plot_note(study::write_contact_cost(rows, out));
  finish_study(out, {"handsim contacts --out again"}, false);
  print("A hand on a stack of slabs, steps of 1 ms.\n\n{}\nfiles in {}{}\n", study::contact_cost_table(rows),
        out.string(), note.text);
  return note.status;
}

}  // namespace handsim::app
