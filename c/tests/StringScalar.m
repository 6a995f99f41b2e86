% A stand-in for a string scalar of MATLAB ("text"), which Octave does not have.
classdef StringScalar
    properties
        text
    end
    methods
        function this = StringScalar(text)
            this.text = text;
        end
        function yes = isstring(~)
            yes = true;
        end
        function text = char(this)
            text = this.text;
        end
    end
end
